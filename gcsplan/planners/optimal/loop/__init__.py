"""The loop of a plan: what a search is, what searches share, and the governor that chooses between them."""
