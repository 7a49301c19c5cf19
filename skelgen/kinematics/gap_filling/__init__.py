"""Gap filling: positions of unseen markers, predicted from their limb, its joints and the frames around."""
