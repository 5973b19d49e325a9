"""The Taylor engine: heyoka."""
