"""The subject: body lengths, footwear, standing angles and walking conditions."""
