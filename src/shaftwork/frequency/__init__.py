"""Small motions about a point: modes, frequency response, Campbell diagram."""
