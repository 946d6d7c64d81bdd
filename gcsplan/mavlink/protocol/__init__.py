"""The mission protocol: who says what when, without sockets and without a clock."""
