"""Flight logs: where an aircraft was and what its battery gave, and the energy model that fits them."""
