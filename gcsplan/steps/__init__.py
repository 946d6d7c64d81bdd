"""The steps of the way of the data: each is one function that takes what the step before it gave; see `pipeline`."""
