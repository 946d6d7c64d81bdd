"""The flow of the data: mission file → world → path → mission → verdict → outputs → vehicles → rehearsal.

Each module is one step: a function that takes the result of the step before it. `fleet` has `plan`, which runs the
steps in order, and `api` the functions that `import gcsplan` provides.
"""
