"""The live page of a mission: samples from the bus in, a picture in browsers out; orders back."""
