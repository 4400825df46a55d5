"""Gallery: flies every method in every scenario and returns a page of pictures."""
