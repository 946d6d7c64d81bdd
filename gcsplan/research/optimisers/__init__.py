"""Black-box optimisers on the unit box. They use numpy alone and know nothing of aircraft, maps or missions.

`registry` lists them all, `minimise` of `driver` runs one. An optimiser is a generator function: it yields a
population (n, dim) in [0, 1] and is sent its costs (n,)::

    def my_rule(run: Run, *, step: float) -> Steps:
        x = run.first()  # (population, dim), uniform
        f = yield x
        for _ in run.cycles():  # one round is one iteration
            tried = clipped(x + step * run.rng.standard_normal(x.shape))
            f_tried = yield tried
            better = f_tried < f
            x[better], f[better] = tried[better], f_tried[better]

Add a row with its paper to the table; then it is run, tested and listed like all others.
"""
