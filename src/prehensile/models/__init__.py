"""The robots, hands, cameras, furniture and objects that come with prehensile, and yours."""
