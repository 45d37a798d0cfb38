"""State machines that decide, and the players that move, as Drake Systems."""
