"""What the code of a generated server shows by itself: its source, its flow of values, what its tools come out at."""
