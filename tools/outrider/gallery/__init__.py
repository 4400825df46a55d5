"""The page of pictures: every method in every scenario."""
