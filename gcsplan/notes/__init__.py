"""Notes on a mission as data: a code, an item and numbers. Its sentences are made at the edge.

Code that finds something makes a `Note`; nothing reads the sentence of one. The catalogue holds all sentences.
"""
