"""Certified separation: committed plans that both sides hold, moving planes between them, and the rule that
nobody replans without the plans of all who could be met."""
