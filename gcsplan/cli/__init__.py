"""The command line: options in, one call, tables or JSON out, an exit code; one module for each kind of command."""
