"""The pictures of the READMEs, and the code that draws them."""
