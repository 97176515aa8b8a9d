"""What perception does dozens of times per frame, compiled: numbers and arrays in, numbers and arrays out."""
