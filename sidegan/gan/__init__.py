"""SIDE-GAN, after figure 1 of the paper; the only door to torch and Lightning.

    generator                    networks.Generator; with its scale and limits generator.TrajectoryGenerator
    … that looks at the motion   networks.Correction
    discriminators, both         networks.Discriminator; with its examples losses.Adversary
    success predictor            surrogates.SuccessPredictor
    converter to the spectrum    surrogates.Converter
    … that go on learning        training.Refreshed
    … to what predicts torques   reward.Energies; by exact physics reward.Worth
    losses                       functions in losses; which a variant adds is in variants
    the adversarial loop         side_gan.SideGAN.training_step; training.train_variant runs it

Other rooms pass arrays, and this one tensors: tensors.numpy_array and torch.tensor are the border.

The recipe as the authors published it: ``Published…`` in variants, and published.
"""
