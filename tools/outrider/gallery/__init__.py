"""Gallery: flies every method in every scenario and writes a page of pictures."""
