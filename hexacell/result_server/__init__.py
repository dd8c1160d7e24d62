"""An OPC UA server of results. It only reads run folders, and no run waits for it."""
