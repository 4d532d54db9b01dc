/* Optima in store: the least IAE that `pidalab.optimal.load` found for each plant of the lab, with Ms at most
   1.4 and a gain from noise to u of at most 20/K, K the gain of the plant. Written by tools/optima.py. */
globalThis.pidalabOptima = { ms: 1.4, noise: 20, designs: {
  "lags3": {
    "PI": {"kp": 0.3302291, "ti": 1.984212, "td": 0.0, "ta": 0.0, "filterTime": 0.001411679, "filterOrder": 1},
    "PID": {"kp": 0.7302197, "ti": 2.037652, "td": 1.115903, "ta": 0.0, "filterTime": 0.02037441, "filterOrder": 2},
    "PIDA": {"kp": 1.231092, "ti": 3.1866, "td": 1.037741, "ta": 0.6506722, "filterTime": 0.1248793, "filterOrder": 3}
  },
  "unequal": {
    "PI": {"kp": 1.032701, "ti": 4.40501, "td": 0.0, "ta": 0.0, "filterTime": 0.001540958, "filterOrder": 1},
    "PID": {"kp": 2.347886, "ti": 3.16761, "td": 1.126879, "ta": 0.0, "filterTime": 0.06604224, "filterOrder": 2},
    "PIDA": {"kp": 3.466257, "ti": 4.708565, "td": 1.189445, "ta": 0.7293922, "filterTime": 0.2199347, "filterOrder": 3}
  },
  "haalman-1": {
    "PI": {"kp": 0.4344747, "ti": 2.265084, "td": 0.0, "ta": 0.0, "filterTime": 0.001359039, "filterOrder": 1},
    "PID": {"kp": 1.210374, "ti": 2.257086, "td": 1.25889, "ta": 0.0, "filterTime": 0.03809038, "filterOrder": 2},
    "PIDA": {"kp": 2.420703, "ti": 3.716719, "td": 1.071822, "ta": 0.7734384, "filterTime": 0.1888158, "filterOrder": 3}
  },
  "haalman-2": {
    "PI": {"kp": 0.2577278, "ti": 3.53704, "td": 0.0, "ta": 0.0, "filterTime": 0.002987566, "filterOrder": 1},
    "PID": {"kp": 0.5452367, "ti": 3.752204, "td": 2.414611, "ta": 0.0, "filterTime": 0.03291322, "filterOrder": 2},
    "PIDA": {"kp": 0.9772896, "ti": 6.185798, "td": 2.1627, "ta": 3.223906, "filterTime": 0.2459275, "filterOrder": 3}
  },
  "heo-1": {
    "PI": {"kp": 0.5198577, "ti": 1.928528, "td": 0.0, "ta": 0.0, "filterTime": 0.001023245, "filterOrder": 1},
    "PID": {"kp": 1.556975, "ti": 1.824802, "td": 0.9310672, "ta": 0.0, "filterTime": 0.03626741, "filterOrder": 2},
    "PIDA": {"kp": 2.798523, "ti": 2.825517, "td": 0.8301498, "ta": 0.3939508, "filterTime": 0.1440515, "filterOrder": 3}
  },
  "vrancic-3": {
    "PI": {"kp": 0.416973, "ti": 1.920627, "td": 0.0, "ta": 0.0, "filterTime": 0.001179695, "filterOrder": 1},
    "PID": {"kp": 1.057416, "ti": 1.92131, "td": 0.9932573, "ta": 0.0, "filterTime": 0.02625638, "filterOrder": 2},
    "PIDA": {"kp": 1.842546, "ti": 2.98162, "td": 0.9134695, "ta": 0.4832188, "filterTime": 0.1318328, "filterOrder": 3}
  },
  "vrancic-6": {
    "PI": {"kp": 18.92147, "ti": 0.9802446, "td": 0.0, "ta": 0.0, "filterTime": 0.000340978, "filterOrder": 1},
    "PID": {"kp": 63.6557, "ti": 0.7292877, "td": 0.2931364, "ta": 0.0, "filterTime": 0.02596536, "filterOrder": 2},
    "PIDA": {"kp": 97.31748, "ti": 1.070767, "td": 0.2986213, "ta": 0.04556673, "filterTime": 0.06960436, "filterOrder": 3}
  },
  "huba-ipdt": {
    "PI": {"kp": 0.2993339, "ti": 7.360183, "td": 0.0, "ta": 0.0, "filterTime": 0.00115935, "filterOrder": 1},
    "PID": {"kp": 0.466441, "ti": 3.798866, "td": 0.4405228, "ta": 0.0, "filterTime": 0.005763132, "filterOrder": 2},
    "PIDA": {"kp": 0.4844209, "ti": 3.903274, "td": 0.4900462, "ta": 0.03505675, "filterTime": 0.0248708, "filterOrder": 3}
  },
  "oscillating": {
    "PI": {"kp": 0.2341458, "ti": 1.079041, "td": 0.0, "ta": 0.0, "filterTime": 2.371842, "filterOrder": 1},
    "PID": {"kp": 0.7850312, "ti": 1.101904, "td": 1.161726, "ta": 0.0, "filterTime": 0.02304146, "filterOrder": 2},
    "PIDA": {"kp": 1.301237, "ti": 1.583671, "td": 0.8604402, "ta": 0.1958034, "filterTime": 0.07204838, "filterOrder": 3}
  },
  "inverse": {
    "PI": {"kp": 0.2802699, "ti": 1.813528, "td": 0.0, "ta": 0.0, "filterTime": 0.001359039, "filterOrder": 1},
    "PID": {"kp": 0.5842848, "ti": 1.95488, "td": 0.9519617, "ta": 0.0, "filterTime": 0.01385258, "filterOrder": 2},
    "PIDA": {"kp": 0.8221205, "ti": 2.629531, "td": 0.9654648, "ta": 0.3751588, "filterTime": 0.07513189, "filterOrder": 3}
  }
} };
