"""Our optimisers beside MetaEvoBox's."""
