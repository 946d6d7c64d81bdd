"""From a `Mission`, whoever made it, to one `Verdict`: safe, violations, or not judged."""
