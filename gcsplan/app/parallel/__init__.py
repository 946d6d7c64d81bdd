"""Work shared by processes or a cluster."""
