"""b2. Bids for velma2, and has it do what it won."""
