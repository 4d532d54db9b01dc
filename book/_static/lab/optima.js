/* Optima from which the search of the lab starts: the least IAE that `pidalab.optimal.load` found for each
   plant of the lab, with Ms at most 1.4 and a gain from noise to u of at most 20/K, K the gain of the
   plant. Written by studies/lab_optima.py. */
globalThis.pidalabOptima = { ms: 1.4, noise: 20, designs: {
  "lags3": {
    "PI": {"kp": 0.3297703, "ti": 1.981397, "td": 0.0, "ta": 0.0, "filterTime": 0.001416565, "filterOrder": 1},
    "PID": {"kp": 0.7301118, "ti": 2.042478, "td": 1.110225, "ta": 0.0, "filterTime": 0.02026739, "filterOrder": 2},
    "PIDA": {"kp": 1.231287, "ti": 3.187649, "td": 1.037577, "ta": 0.6508121, "filterTime": 0.1249014, "filterOrder": 3}
  },
  "unequal": {
    "PI": {"kp": 1.033302, "ti": 4.407792, "td": 0.0, "ta": 0.0, "filterTime": 0.001547182, "filterOrder": 1},
    "PID": {"kp": 2.347901, "ti": 3.17376, "td": 1.124329, "ta": 0.0, "filterTime": 0.06589202, "filterOrder": 2},
    "PIDA": {"kp": 3.466504, "ti": 4.709165, "td": 1.189389, "ta": 0.7294076, "filterTime": 0.2199422, "filterOrder": 3}
  },
  "haalman-1": {
    "PI": {"kp": 0.4322875, "ti": 2.253593, "td": 0.0, "ta": 0.0, "filterTime": 0.001363742, "filterOrder": 1},
    "PID": {"kp": 1.210479, "ti": 2.252134, "td": 1.261785, "ta": 0.0, "filterTime": 0.0381804, "filterOrder": 2},
    "PIDA": {"kp": 2.42139, "ti": 3.724139, "td": 1.071324, "ta": 0.7734018, "filterTime": 0.1888346, "filterOrder": 3}
  },
  "haalman-2": {
    "PI": {"kp": 0.2590543, "ti": 3.555093, "td": 0.0, "ta": 0.0, "filterTime": 0.002997905, "filterOrder": 1},
    "PID": {"kp": 0.54524, "ti": 3.745059, "td": 2.41703, "ta": 0.0, "filterTime": 0.03294565, "filterOrder": 2},
    "PIDA": {"kp": 0.9782673, "ti": 6.190951, "td": 2.160793, "ta": 3.233152, "filterTime": 0.2463983, "filterOrder": 3}
  },
  "heo-1": {
    "PI": {"kp": 0.5175129, "ti": 1.919753, "td": 0.0, "ta": 0.0, "filterTime": 0.001023245, "filterOrder": 1},
    "PID": {"kp": 1.556731, "ti": 1.826546, "td": 0.9273782, "ta": 0.0, "filterTime": 0.03611695, "filterOrder": 2},
    "PIDA": {"kp": 2.798025, "ti": 2.82423, "td": 0.830319, "ta": 0.393828, "filterTime": 0.1440172, "filterOrder": 3}
  },
  "vrancic-3": {
    "PI": {"kp": 0.4175465, "ti": 1.923211, "td": 0.0, "ta": 0.0, "filterTime": 0.001179695, "filterOrder": 1},
    "PID": {"kp": 1.057339, "ti": 1.930989, "td": 0.9876154, "ta": 0.0, "filterTime": 0.02610419, "filterOrder": 2},
    "PIDA": {"kp": 1.843191, "ti": 2.984464, "td": 0.9130909, "ta": 0.4834463, "filterTime": 0.1318863, "filterOrder": 3}
  },
  "vrancic-6": {
    "PI": {"kp": 18.89463, "ti": 0.9788516, "td": 0.0, "ta": 0.0, "filterTime": 0.000340978, "filterOrder": 1},
    "PID": {"kp": 63.65838, "ti": 0.7311227, "td": 0.2924523, "ta": 0.0, "filterTime": 0.02590561, "filterOrder": 2},
    "PIDA": {"kp": 97.33639, "ti": 1.071666, "td": 0.2985666, "ta": 0.04557479, "filterTime": 0.06961621, "filterOrder": 3}
  },
  "huba-ipdt": {
    "PI": {"kp": 0.2996454, "ti": 7.374622, "td": 0.0, "ta": 0.0, "filterTime": 0.00115935, "filterOrder": 1},
    "PID": {"kp": 0.4661799, "ti": 3.783131, "td": 0.4430846, "ta": 0.0, "filterTime": 0.005797636, "filterOrder": 2},
    "PIDA": {"kp": 0.4885357, "ti": 3.972445, "td": 0.5075166, "ta": 0.04765037, "filterTime": 0.03377915, "filterOrder": 3}
  },
  "oscillating": {
    "PI": {"kp": 0.2349297, "ti": 1.084286, "td": 0.0, "ta": 0.0, "filterTime": 2.369741, "filterOrder": 1},
    "PID": {"kp": 0.7847995, "ti": 1.099157, "td": 1.16288, "ta": 0.0, "filterTime": 0.02305751, "filterOrder": 2},
    "PIDA": {"kp": 1.298904, "ti": 1.579118, "td": 0.8621831, "ta": 0.1954538, "filterTime": 0.07192488, "filterOrder": 3}
  },
  "inverse": {
    "PI": {"kp": 0.2811434, "ti": 1.819104, "td": 0.0, "ta": 0.0, "filterTime": 0.001363742, "filterOrder": 1},
    "PID": {"kp": 0.5842628, "ti": 1.952199, "td": 0.9539086, "ta": 0.0, "filterTime": 0.01388013, "filterOrder": 2},
    "PIDA": {"kp": 0.8225427, "ti": 2.63373, "td": 0.9645354, "ta": 0.3757472, "filterTime": 0.07520483, "filterOrder": 3}
  }
} };
