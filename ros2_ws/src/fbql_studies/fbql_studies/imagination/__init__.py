"""Study: how much of fbql_model is built in, and how much is learned."""
