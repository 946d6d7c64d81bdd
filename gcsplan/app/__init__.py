"""The way of the data: mission file → world → path → mission → verdict → outputs → vehicles → rehearsal.

Each module is one step, a function that takes what the step before it gave; `pipeline` puts them in a row, and
`scripting` is what `import gcsplan` shows.
"""
