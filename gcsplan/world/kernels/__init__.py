"""The exact check of legs as kernels of machine code, and the arrays that they read."""
