"""Research: swarm planners, the optimisers below them, and the benches of the papers; loaded only when named.

It imports the product, never the other way round: a plan by `optimal` needs nothing of this folder.
"""
