"""shao2012: radar and infrared on an unmanned aircraft, fused and tracked in modified spherical coordinates."""
