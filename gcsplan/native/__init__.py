"""Compiled kernels without the wait: machine code from a shipped intermediate form, cached on disk.

numba turns Python into LLVM's intermediate form and that into machine code. The first half takes most of the time, more
than ten seconds for the exact check, and depends only on the source. So a developer does it once
(`python -m gcsplan.native`), and the result lies beside the source (`gcsplan.native.cache`). The first run does only
the second half, for its own machine, in a fraction of a second, and caches the machine code. If the source has changed
since, or the shipped form cannot be read, numba does the first half on the spot.

A unit with ``vectors`` is vectorised before it is shipped, its sums in the order that suits the vectors. After that no
order may change and no two operations may be fused, so that every machine gets the same bits.
"""
