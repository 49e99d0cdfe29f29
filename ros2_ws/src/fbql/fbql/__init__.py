"""The front door of FBQL: from Python `import fbql`, in a shell `fbql COMMAND`."""
