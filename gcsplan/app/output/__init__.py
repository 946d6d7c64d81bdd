"""What a plan or a check leaves: files, records, reports, lists."""
