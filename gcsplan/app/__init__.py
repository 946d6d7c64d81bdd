"""The flow of the data: mission file → world → path → mission → verdict → outputs → vehicles → rehearsal.

Each module is one step: a function that takes the result of the step before it. `pipeline` runs the steps in order, and
`scripting` holds the functions that `import gcsplan` provides.
"""
