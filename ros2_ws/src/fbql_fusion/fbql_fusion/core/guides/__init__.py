"""The rules from which guides are made: which behavior would drive without learning."""
