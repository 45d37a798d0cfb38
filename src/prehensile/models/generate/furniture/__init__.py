"""Tables, bins, shelves and cupboards."""
