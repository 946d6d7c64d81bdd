"""From the page to files and vehicles: the command line's own steps, with the plan that the page shows."""
