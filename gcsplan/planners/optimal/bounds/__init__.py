"""Sources of lower bounds: lengths and energies that no path can beat."""
