"""``wind:`` of a mission file, and the forecasts that it names, as a `gcsplan.wind.declared.DeclaredWind`."""
