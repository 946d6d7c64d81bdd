"""The check: it judges a `Mission` of any origin and returns one `Verdict`: safe, violations, or not judged."""
