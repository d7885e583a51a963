"""b1. Bids for velma1, and has it do what it won."""
