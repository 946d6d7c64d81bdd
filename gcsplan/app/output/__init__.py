"""The outputs of a plan or a check: files, records, reports, lists."""
