"""What is asked of input, the words of a refusal, and tables."""
