"""The commands, a module for each kind: options in, one call, tables or JSON out."""
