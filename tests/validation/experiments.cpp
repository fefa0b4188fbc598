#include "tests/validation/experiments.h"

namespace trocar::validation {

const std::vector<Experiment>& experiments() {
  static const std::vector<Experiment> all{
      {"choi2002/eq2", "How many nodes a force reaches", "Choi 2002, equation 2", run_eq2},
      {"choi2002/fig2-several-users", "Three hands pull at once",
       "Choi 2002, section 2.3, figure 2", run_fig2_users},
      {"choi2002/fig3-transverse-isotropy", "Transversely isotropic against isotropic tissue",
       "Choi 2002, figure 3", run_fig3_transverse},
      {"choi2002/fig4-hysteresis", "Hysteresis under cyclic load", "Choi 2002, figure 4",
       run_fig4_hysteresis},
      {"choi2002/creep", "Creep", "Choi 2002, section 4; Kelvin-Voigt in closed form", run_creep},
      {"choi2002/relaxation", "Stress relaxation",
       "Choi 2002, section 1; Kelvin-Voigt in closed form", run_relaxation},
      {"choi2002/fig5-profiles", "Profile of the surface for several penetration depths",
       "Choi 2002, figure 5", run_fig5_profiles},
      {"choi2002/fig6-time-split", "Where the time goes", "Choi 2002, figure 6", run_fig6_times},
      {"choi2002/fig7-fig8-organs", "Hollow stomach and liver deform", "Choi 2002, figures 7 and 8",
       run_fig7_fig8_organs},
      {"choi2002/palpation-inclusion", "A stiff inclusion is felt",
       "Choi 2002, section 3, discussion", run_palpation},
      {"nakao2003/plate", "A straight cut in a plate under tension",
       "Nakao 2003, section 5.1, figures 10 to 12", run_plate},
      {"nakao2003/fig15-fig17-refresh", "Time per cycle, with and without a controller",
       "Nakao 2003, figures 15 to 17", run_refresh_rate},
      {"nakao2003/fig15-fig17-cutting", "Time per cycle while a blade cuts",
       "Nakao 2003, figures 15 to 17", run_refresh_cutting},
      {"dogan2011/calculix", "The full model beside an independent solver",
       "CalculiX; Dogan 2011, section 2", run_calculix_comparison},
      {"dogan2011/locking", "What linear tets lose at table 1's bulk modulus",
       "quadratic elements, our own", run_locking},
      {"dogan2011/creep", "A measured liver creeps under a constant force",
       "Dogan 2011, figures 2, 6 and 7", run_dogan_creep},
      {"dogan2011/live", "A hand presses the measured liver live", "converged solution, our own",
       run_dogan_live},
      {"dogan2011/reduction", "A reduced liver beside the full one",
       "Dogan 2011, equations 6 to 14, figures 3 to 7", run_dogan_reduction},
      {"ours/feel", "What a hand feels over a network", "the same organ without delay, our own",
       run_feel},
      {"ours/propagation-lattice", "What a limit of nodes costs: lattice", "full solve, our own",
       run_propagation_lattice},
      {"ours/propagation-liver-4k", "What a limit of nodes costs: liver of 4,000 nodes",
       "full solve, our own", run_propagation_liver},
      {"ours/propagation-liver-17k", "What a limit of nodes costs: liver of 17,000 nodes",
       "full solve, our own", run_propagation_large_liver},
      {"ours/propagation-stomach", "What a limit of nodes costs: stomach", "full solve, our own",
       run_propagation_stomach},
      {"ours/bar", "Bar in tension", "closed form: F L / (E A)", run_bar},
      {"ours/cantilever", "Thick cantilever", "closed form: Timoshenko", run_cantilever},
      {"ours/presses", "Contact forces of four organs", "quadratic elements, our own", run_presses},
      {"ours/indentation", "Indentation of a half-space", "closed forms: Hertz; bonded flat punch",
       run_indentation},
  };
  return all;
}

}  // namespace trocar::validation
