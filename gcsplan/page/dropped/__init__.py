"""Files that are dropped on the map: kept in memory, read by the product's own readers, written only when taken."""
