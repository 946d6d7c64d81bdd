"""Vehicles over a link: sockets, frames, the clock, the vehicle's state, and the public functions (`session`)."""
