/* Optima in store: the least IAE that `pidalab.optimal.load` found for each plant of the lab, with Ms at most
   1.4 and a gain from noise to u of at most 20/K, K the gain of the plant. Written by tools/optima.py. */
globalThis.pidalabOptima = { ms: 1.4, noise: 20, designs: {
  "lags3": {
    "PI": {"kp": 0.328504, "ti": 1.973866, "td": 0.0, "ta": 0.0, "filterTime": 0.001416565, "filterOrder": 1},
    "PID": {"kp": 0.7301893, "ti": 2.04767, "td": 1.110641, "ta": 0.0, "filterTime": 0.02027755, "filterOrder": 2},
    "PIDA": {"kp": 1.231489, "ti": 3.187338, "td": 1.037359, "ta": 0.6514871, "filterTime": 0.1249767, "filterOrder": 3}
  },
  "unequal": {
    "PI": {"kp": 1.033991, "ti": 4.411532, "td": 0.0, "ta": 0.0, "filterTime": 0.001547182, "filterOrder": 1},
    "PID": {"kp": 2.347517, "ti": 3.163657, "td": 1.124931, "ta": 0.0, "filterTime": 0.06591752, "filterOrder": 2},
    "PIDA": {"kp": 3.468119, "ti": 4.708348, "td": 1.18879, "ta": 0.7318508, "filterTime": 0.2203323, "filterOrder": 3}
  },
  "haalman-1": {
    "PI": {"kp": 0.4311243, "ti": 2.24754, "td": 0.0, "ta": 0.0, "filterTime": 0.001363742, "filterOrder": 1},
    "PID": {"kp": 1.210395, "ti": 2.248066, "td": 1.262874, "ta": 0.0, "filterTime": 0.03821121, "filterOrder": 2},
    "PIDA": {"kp": 2.424065, "ti": 3.733181, "td": 1.070103, "ta": 0.7744572, "filterTime": 0.1890615, "filterOrder": 3}
  },
  "haalman-2": {
    "PI": {"kp": 0.259444, "ti": 3.560556, "td": 0.0, "ta": 0.0, "filterTime": 0.002997905, "filterOrder": 1},
    "PID": {"kp": 0.5451589, "ti": 3.746028, "td": 2.412368, "ta": 0.0, "filterTime": 0.03287788, "filterOrder": 2},
    "PIDA": {"kp": 0.9784149, "ti": 6.190361, "td": 2.160579, "ta": 3.236107, "filterTime": 0.246531, "filterOrder": 3}
  },
  "heo-1": {
    "PI": {"kp": 0.5198577, "ti": 1.928528, "td": 0.0, "ta": 0.0, "filterTime": 0.001023245, "filterOrder": 1},
    "PID": {"kp": 1.556975, "ti": 1.824801, "td": 0.9310672, "ta": 0.0, "filterTime": 0.03626741, "filterOrder": 2},
    "PIDA": {"kp": 2.798522, "ti": 2.82551, "td": 0.8301503, "ta": 0.3939508, "filterTime": 0.1440514, "filterOrder": 3}
  },
  "vrancic-3": {
    "PI": {"kp": 0.4169731, "ti": 1.920627, "td": 0.0, "ta": 0.0, "filterTime": 0.001179695, "filterOrder": 1},
    "PID": {"kp": 1.057415, "ti": 1.921243, "td": 0.9932715, "ta": 0.0, "filterTime": 0.02625703, "filterOrder": 2},
    "PIDA": {"kp": 1.842546, "ti": 2.98162, "td": 0.9134694, "ta": 0.4832189, "filterTime": 0.1318328, "filterOrder": 3}
  },
  "vrancic-6": {
    "PI": {"kp": 18.92147, "ti": 0.9802445, "td": 0.0, "ta": 0.0, "filterTime": 0.000340978, "filterOrder": 1},
    "PID": {"kp": 63.6557, "ti": 0.7292867, "td": 0.2931365, "ta": 0.0, "filterTime": 0.02596537, "filterOrder": 2},
    "PIDA": {"kp": 97.3175, "ti": 1.070769, "td": 0.2986214, "ta": 0.04556695, "filterTime": 0.06960458, "filterOrder": 3}
  },
  "huba-ipdt": {
    "PI": {"kp": 0.2993339, "ti": 7.360183, "td": 0.0, "ta": 0.0, "filterTime": 0.00115935, "filterOrder": 1},
    "PID": {"kp": 0.466441, "ti": 3.798866, "td": 0.4405228, "ta": 0.0, "filterTime": 0.005763131, "filterOrder": 2},
    "PIDA": {"kp": 0.4844209, "ti": 3.903274, "td": 0.4900462, "ta": 0.03505675, "filterTime": 0.0248708, "filterOrder": 3}
  },
  "oscillating": {
    "PI": {"kp": 0.2343128, "ti": 1.080437, "td": 0.0, "ta": 0.0, "filterTime": 2.370624, "filterOrder": 1},
    "PID": {"kp": 0.7850038, "ti": 1.101824, "td": 1.161832, "ta": 0.0, "filterTime": 0.02304278, "filterOrder": 2},
    "PIDA": {"kp": 1.301237, "ti": 1.583671, "td": 0.8604404, "ta": 0.1958033, "filterTime": 0.07204836, "filterOrder": 3}
  },
  "inverse": {
    "PI": {"kp": 0.2818625, "ti": 1.823825, "td": 0.0, "ta": 0.0, "filterTime": 0.001363742, "filterOrder": 1},
    "PID": {"kp": 0.5842248, "ti": 1.951681, "td": 0.9542815, "ta": 0.0, "filterTime": 0.01388484, "filterOrder": 2},
    "PIDA": {"kp": 0.8227983, "ti": 2.636754, "td": 0.963212, "ta": 0.3772942, "filterTime": 0.07536189, "filterOrder": 3}
  }
} };
