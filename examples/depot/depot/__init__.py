"""depot: a depot: people order transports, two mobile robots of different speed carry them."""
