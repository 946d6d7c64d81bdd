"""The loop of a plan: the protocol of searches, their shared workspace, and the governor that chooses between them."""
