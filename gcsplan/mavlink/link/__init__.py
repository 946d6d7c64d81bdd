"""Vehicles over a link: sockets, frames, the clock, who is there, and what a user calls (`session`)."""
