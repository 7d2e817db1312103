"""What a person looks at: state, devices, attempts and logs."""
