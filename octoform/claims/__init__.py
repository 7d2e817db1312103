"""Claims: diagnoses that cite readings, hold only as long as the readings do, and can always be taken back."""
