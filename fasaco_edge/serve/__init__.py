"""A live page of a mission: samples off the bus in, a picture in browsers out; orders back."""
