"""MAVLink: mission items, mission files, the transfer protocol (without sockets), and links (with them)."""
