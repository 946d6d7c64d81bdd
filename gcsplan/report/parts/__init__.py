"""The parts that all views of a page share: its data, labels and HTML."""
