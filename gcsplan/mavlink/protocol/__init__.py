"""The mission protocol: which message follows which, without sockets and without a clock."""
