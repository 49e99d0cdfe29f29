"""Pictures of trees and curves, as text: SVG documents, and DOT for Graphviz."""
