"""From files to verdicts: the world that they are judged in, one file or many."""
