"""Zones as authorities publish them: OpenAir, ED-269, ED-318 and openAIP, each with a module that reads it.

`policy` decides which published zones are no-fly, `times` when they apply, `volumes` turns what a format says of one
volume into the drafts that all zone files share, and `unused` names the zones near the mission that are not used.
"""
