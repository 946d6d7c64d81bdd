"""Compiled kernels without the wait: machine code from an intermediate form that is shipped, kept on disk.

numba turns Python into LLVM's intermediate form and that into machine code. The first half takes most of the time,
more than ten seconds for the exact check, and depends on nothing but the source; so it is done once, by a developer
(`python -m gcsplan.native`), and its outcome lies beside the source (`gcsplan.native.shelf`). At the first run only
the second half is left, for the machine at hand, a fraction of a second, and the machine code is kept in a cache.
Where the source has changed since, or the shipped form cannot be read, numba does the first half there and then.

A unit with ``vectors`` is cut to vectors before it is shipped, its sums in whatever order suits them; after that no
order may change and no two operations may be fused, so that every machine gets the same bits.
"""
